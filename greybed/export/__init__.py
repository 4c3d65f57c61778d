"""Closures for other programs: a C++ header, an ONNX graph, and the replay that compares them."""

from greybed.export.cpp import export_cpp
from greybed.export.drag_cpp import export_drag_cpp
from greybed.export.drag_onnx import export_drag_onnx
from greybed.export.drag_replay import CompiledDrag, OnnxDrag
from greybed.export.replay import CompiledClosure, OnnxClosure, compile_cpp, find_compiler
from greybed.export.to_onnx import export_onnx

__all__ = [
    "CompiledClosure",
    "CompiledDrag",
    "OnnxClosure",
    "OnnxDrag",
    "compile_cpp",
    "export_cpp",
    "export_drag_cpp",
    "export_drag_onnx",
    "export_onnx",
    "find_compiler",
]
