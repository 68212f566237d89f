"""Import recordings of other programs as logs.

Reading   tables (documents too) <- text (header), matlab, npy -> raw: named columns
Recipe    recipe: the keys and their checks; patterns: names of files
Import    assemble -> repair -> units -> make_log; clock
Draft     guess <- inference <- recording <- groups <- names (vocabulary.toml); evidence,
          units_of_draft and notes: what numbers, a robot's links and lines of the file say
Numbers   config
"""
