"""When a corrected pose is believed, and when the passes of the corrections have come to rest."""
