"""The viewer's page in a headless browser, and how quick it is there."""
