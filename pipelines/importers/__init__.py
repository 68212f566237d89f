"""Import recordings of other programs as logs.

Reading   tables (documents too) <- text (header), matlab, npy -> raw: named columns
Recipe    recipe: the keys and their checks; patterns: names of files
Import    assemble -> repair -> units -> make_log; clock
Draft     guess <- hypotheses (units) <- signals (columns) <- columns <- names (vocabulary.toml);
          evidence, links and notes: what numbers, a robot's links and lines of the file show
Numbers   config
"""
