"""Studies: what accuracy costs, what breaks first, what can be proven, and what is wrong in a file.

work_precision_diagram/  error against time of every method and of other programs
certificate/             true digits of M, C, N, inverse and forward dynamics, against balls
costs/                   instructions and times of effects, control and algorithms
stress_test/             worst configurations, limits and random runs, each judged
proof/                   enclosures of q(t) and v(t)
doctor/                  checks of URDF files
advice                   whether step and control period are short enough
save, figure             the one writer of results, the one layout of their figures
budget, timing, environment  time to spend, times in turns, versions and processor
"""
