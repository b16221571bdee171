"""The benchmark as a task of `tractexp`, for sweeps."""
