"""What the simulation of an arm gets wrong, and why: every effect tried on what the nominal model leaves.

`diagnose` is the whole of it in the order in which it happens, `changed` the same with reference logs, `extend` what follows for
causes that somebody names. Where to look, in that order:

    asked           settings, gates, inputs, memory
    rows            data, sharper, stretch, signals; at_rest, which do not count; kept, what was laid already; ripple and whitening,
                    noise of rows
    nominal model   nominal, dissipation, curves, change_of_sign, terms_apart; linear, least squares around a solution
    what acts       exact, record, slopes, refit; beside, what is known from elsewhere; numbers, as they are reported
    responses       responding, compliance: what gives way is named by them, and subtracted first

    floor           floored: by a twin (replay, twin, drive_noise, imperfections, clean, waves), or stored (calibration, calibrated,
                    calibration_file); motion_floor and by_speed, of other motion; thresholds, wide, what has to be exceeded
    search          case, candidates, screen, through; gate, hypotheses, ledger, search; parsimony, elsewhere, unnameable, wanted
    second look     second_look, in white rows; steadied, unbiased, what noise and sampling did to the numbers

    believed        verdict; pruned, what is dropped again: borne_out, chance, blocked, fewer, mended, mistaken, momentary,
                    straying, which_joint; held_out, gains, chain, what it is worth; doubted, with own_motion, oscillating,
                    extrapolated
    what changed    since, standing, standing_shapes, stood, unchanged; absorbed and carried, what base parameters took in

    told            told, findings, joined, evidence, simulated, words, result, outcome
    not told        limits, with injection and injection_of_shapes: what would have been found; without_limit, unasked
"""
