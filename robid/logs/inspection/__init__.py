"""What is in a log that nobody has described yet.

Read in this order: contents (what is read), sampling and quality (one kind of finding each), vocabulary, names,
relations and roles (what each variable is), sides, channels and excitation (what to import), findings (all of it) and
text (what to say about it).
"""
