"""Lists every test that touched one sample, or that one triangle caused: a slow walk that a reader can follow.

The walks use the same planes, trees and rules as the methods' kernels, one frustum, ray or face after the other, in plain
Python; tests compare what they list with the kernels' heat maps and counts.
"""
