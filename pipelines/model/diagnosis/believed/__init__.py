"""What of a search is believed: what is dropped again, what is doubted, and what a second look finds.

    pruned         the whole of it: what does not repeat, or no longer pays, is dropped
    fewer          models with some of the causes only
    chance         a gain that may be chance
    straying       the simulated arm does not come nearer
    momentary      it acts only while something that happened once lasts, or that alone is no explanation
    repeated       logs do not agree on it, or beside the others it is no more than chance
    mistaken       for what it could have been mistaken
    mended         it only mends the shape of another
    which_joint    logs do not tell at which joint it is
    steadied       numbers refitted with the ripple of drives among the noise

    second_look    where the noise is white: what slow noise hides
    doubted        held against what the search was not made of
    oscillating    what is left of a joint oscillates by itself
"""
