"""Import recordings of other programs as logs.

Reading        sources, tables (with text_format), array_files -> raw: a table of named columns
Recipe         recipe: the keys and their checks; filenames: patterns of files
Import         assemble -> repair -> joint_side -> make_log; clock; controller_side, run backwards
Draft          guess <- inference <- reading <- column_groups <- column_names;
               evidence, unit_guess and stated say what numbers, units and lines of the file mean
"""
