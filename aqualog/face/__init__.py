"""The Python face: the functions behind `import aqualog as aq`, one module each. A command is one call of one."""
