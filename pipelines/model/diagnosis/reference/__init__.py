"""What the reference logs have as well, and what base parameters took in since they were recorded.

    standing           what was there from the first day
    standing_shapes    its shapes, fitted exactly beside the nominal laws
    stood              how much of what was found later these logs have
    absorbed           causes that base parameters take in, told by how these moved

`given.since` asks the later logs what has changed, and `believed.unchanged` drops again what has not.
"""
