"""Many runs side by side: how good, how fast, and whether a difference is more than chance."""
