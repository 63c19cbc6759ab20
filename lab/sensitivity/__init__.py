"""What doubling and halving each threshold of the joint step does to its results."""
