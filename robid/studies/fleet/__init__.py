"""Faults among many logged robots, and the speed of `robid reprocess`.

Read the parts in the order of the page: `logs` with its robots and their faults, `whole`, `speed`.
"""
