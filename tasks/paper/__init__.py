"""What it takes to repeat the paper's tables and figures: a small made-up world, planted offsets, published poses."""
