"""Design experiments on an arm: what a motion tells about its parameters, within its limits."""
