"""Measured frequency responses of others: files of analysers, MATLAB and drives, and what stands in them."""
