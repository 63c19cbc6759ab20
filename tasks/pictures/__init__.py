"""Pictures of what was found: limb segments, flow fields, distributions. Nothing here is part of a step."""
