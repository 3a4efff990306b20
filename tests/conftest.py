"""Makes `appendages`, the shared builders beside this file, importable from every test folder.

Pytest's default import mode puts the folder of the topmost conftest (this one) on `sys.path`.
"""
