"""Remember what a run has computed: nothing is computed again while everything it came from is the same.

    code.py     which source files a stage consists of, and their hashes
    key.py      all that a stage's result depends on, as one hash; and in words, what of it has changed
    store.py    results by their keys: written stage by stage, verified when they are taken back

Only hashes of contents are compared, never times. What is stored is JSON, HDF5 and the files that the stage wrote.
"""
