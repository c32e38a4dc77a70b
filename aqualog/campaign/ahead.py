"""Imported last by the process from which workers are forked: the machine code of what it has imported before."""

from aqualog.core.compiled import load_kept

load_kept()
