"""Base regressor, library of candidate effects with their columns and Gram matrices, prior, healthy sizes."""
