"""Which effect is missing from a model.

`comparison` says where a model misses, `search` which effect it lacks, `further` which trials
would tell more, `answer` says it all as plain data; `diagnose` runs them in this order. Nothing
here knows cables, rigs or simulators: it sees a `Model`.
"""
