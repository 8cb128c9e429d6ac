"""The thin layer over Pinocchio: Robot gives M, C, N, inverse and forward dynamics by CRBA, RNEA and ABA."""
