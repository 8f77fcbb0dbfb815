"""Faults among many logged robots, and the speed of `robid reprocess`.

Read `robots`, then the parts in the order of the page: `logs`, `whole`, `speed`.
"""
