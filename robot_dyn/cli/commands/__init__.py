"""The commands, by topic.

query.py      on robots: list, info, query, compare
simulate.py   on scenes: simulate, explain, parameters, scene
show.py       pages and pictures: show, replay, plot
cost.py       what accuracy costs: work-precision, cost, certify, advise
diff_runs.py, cache.py, demo.py, export.py    one command each

Commands of tools are entry points `robot_dyn.commands`, in the folders of the tools.
"""
