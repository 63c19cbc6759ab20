"""Compare: image against simulation, by brightness, similarity and limb. Shared by the correction steps."""
