"""The commands, by topic.

query.py      on robots: list, info, query, compare
simulate.py   on scenes: simulate, explain, sweepable, scene
sweep.py      many runs of a scene into a folder
show.py       pages and pictures: show, replay, plot
cost.py       what accuracy costs: accuracy, cost, certify, advise
prove.py, stress.py, diff.py, check.py, cache.py, demo.py    one command each
"""
