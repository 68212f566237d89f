"""Remember what a run has computed: nothing is computed again while everything it came from is the same.

    code.py     which source files a stage consists of, and their hashes
    key.py      all that a stage's result depends on, as one hash; and in words, what of it has changed
    chain.py    the inputs on their way through the stages: what each stage gets, and the key of what it gives
    store.py    results by their keys: written stage by stage, verified when they are taken back
    pictures.py figures of the last run, where nothing about them has changed

Only hashes of contents are compared, never times. What is stored is JSON, HDF5 and the files that the stage wrote.
"""
