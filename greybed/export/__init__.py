"""Closures for other programs: a C++ header, an ONNX graph, and the replay that compares them."""

from greybed.export.header import export_cpp, form_of
from greybed.export.library import (
    CompiledLibrary,
    FortranProgram,
    compile_c,
    export_c,
    find_fortran,
)
from greybed.export.replay import CompiledClosure, OnnxClosure, compile_cpp, find_compiler
from greybed.export.to_onnx import export_onnx

__all__ = [
    "CompiledClosure",
    "CompiledLibrary",
    "FortranProgram",
    "OnnxClosure",
    "compile_c",
    "compile_cpp",
    "export_c",
    "export_cpp",
    "export_onnx",
    "find_compiler",
    "find_fortran",
    "form_of",
]
