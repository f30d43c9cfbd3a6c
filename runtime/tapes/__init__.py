"""Kernels of a library as differentiable functions of torch and JAX, over batches of samples."""
