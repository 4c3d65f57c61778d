"""Closures for other programs: a C++ header, an ONNX graph, and the replay that compares them."""

from greybed.export.header import export_cpp
from greybed.export.replay import CompiledClosure, OnnxClosure, compile_cpp, find_compiler
from greybed.export.to_onnx import export_onnx

__all__ = [
    "CompiledClosure",
    "OnnxClosure",
    "compile_cpp",
    "export_cpp",
    "export_onnx",
    "find_compiler",
]
