"""What is in a log that nobody has described yet.

Read in this order: contents (what is read), sampling, quality, repetition (one kind of finding each), names, relations, roles
(what each variable is), proposal and its text, findings (all of it together).
"""
