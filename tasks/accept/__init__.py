"""When a corrected pose is accepted, and when the passes of the corrections have come to rest."""
