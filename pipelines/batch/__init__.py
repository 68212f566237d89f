"""Many folders of logs: a stage on each of them, in processes that can die alone, and one summary of all.

    batch.py      the whole: what is done already, what is left, when to stop, the summary
    items.py      which folders are items          plan.py      the stage with its settings, as a text any process can read
    work.py       one item, in a warm process      record.py    what became of it, and the ledger
    pool.py       processes of this machine        server.py    what they are forked from
    cluster.py    a Dask cluster                   child.py     the process that each of its workers keeps
    folder.py     what stands where in the output  lock.py, signals.py
    drift.py, baseline.py    how figures moved     summary.py     the report and the table
    result.py, junit.py      the same for machines

An item's result is what its own command gives, whoever works on it, in whatever order, and after whatever interruption.
"""
