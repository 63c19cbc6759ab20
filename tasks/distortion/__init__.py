"""What is known about the distortion of one image: every method measured, figures: `planetpose distortion`."""
