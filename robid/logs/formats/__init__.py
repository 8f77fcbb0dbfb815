"""Log files behind one mapping.

Read variables (the table of formats, and what a reader finds) and load; then tables with layout, moments, telling and
recorders for those of text; then mat, containers and messages.
"""
