"""What every implementation answers.

dynamics: `Dynamics`, the queries and their table · quantity: a row of it · batch: states without an answer
units: SI units of joints, and numbers with their units as texts
"""
