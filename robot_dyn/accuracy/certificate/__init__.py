"""Certificates: true digits of M, C, N, inverse and forward dynamics, and the time of each query.

certify            the study and its result
digit_count        the implementations, and their errors against finer arithmetic and balls
worst_case_search  the search for the state of largest error
diagram            the figure
"""
