"""Export a model: URDF, MJCF, C99 or JSON, each with a card and a proof.

target.py    the arm as a target holds it, and what becomes of each cause
urdf.py      a URDF, loaded again in Pinocchio
mjcf.py      an MJCF model, loaded again in MuJoCo
c_code.py    a C99 function, compiled
table.py     a flat JSON table
states.py    states and motions at which they are compared
card.py      what was carried, approximated and lost, as a report
"""
