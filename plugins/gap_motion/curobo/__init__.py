"""Provider `hf` of `curobo.*`: paths found by cuRobo on a GPU, where it is installed."""
