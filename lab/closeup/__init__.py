"""Benchmark of close-ups: frames without a limb by an independent ray caster, matched to another map than their own."""
