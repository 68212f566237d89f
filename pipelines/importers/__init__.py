"""Import recordings of other programs as logs.

Reading   tables (READERS: one reader a format) <- text, arrays; raw: named columns
Recipe    recipe: the keys and their checks; patterns: names of files; collect: all that is read
Import    make_log <- clock, repair, units
Draft     guess <- roles (columns) <- names; links: the torque of the robot's own links
Plans     controller: a planned motion in a recipe's columns
Numbers   config
"""
