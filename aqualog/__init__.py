"""Find aquaplaning in drive logs.

Nothing heavy is imported here: `import aqualog` must stay cheap.
"""

__all__ = ["__version__"]

__version__ = "0.10.0"
