"""What is in a log that nobody has described yet.

Read in this order: contents (what is read), sampling, quality, repetition (one kind of finding each), names, relations
and roles (what each variable is), channels and proposal (what to import), findings (all of it), text and words.
"""
