"""What an arm in order leaves, and so what a cause has to exceed before it is believed.

    twin                the fitted model run through the same experiments, and analysed alike
    replay              what a log asks of an arm that is run in its place
    drive_noise         the noise of its drives
    repeated            what repeats with the motion is none
    waves               waves along an angle are none
    motion_floor        what the arm in order would leave of other motion
    by_speed            and at speeds that the reference logs only pass

    thresholds          what the twin shows of a cause and of its like
    wide                the same of causes that act on several joints
    calibration         thresholds as they are stored
    calibrated          stored by one diagnosis, taken for the logs of another
    calibration_file    their files

Which of these a floor is taken from, where there are no reference logs, `given.floored` says: a first search goes before.
"""
