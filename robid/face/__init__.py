"""The public Python face; `robid` itself leads here when one of its names is used.

To read in this order: runs, parameters, robots, responses, measured, designs, fits, control.
"""
