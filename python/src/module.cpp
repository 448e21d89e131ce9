// prolate._core: the C++ side of the Python package. It takes any objects, checks them, and calls the library; names,
// docstrings and default values are those of python/prolate/*.py.
#include "python/src/tree.hpp"

#include <prolate/build.hpp>
#include <prolate/version.hpp>

namespace prolate::python {
namespace {

const char* name_of(ErrorCode code) {
    switch (code) {
    case ErrorCode::bad_options:
        return "bad_options";
    case ErrorCode::bad_mesh:
        return "bad_mesh";
    case ErrorCode::bad_file:
        return "bad_file";
    case ErrorCode::newer_version:
        return "newer_version";
    case ErrorCode::io:
        return "io";
    case ErrorCode::cancelled:
        return "cancelled";
    case ErrorCode::unsupported:
        return "unsupported";
    case ErrorCode::internal:
        return "internal";
    case ErrorCode::out_of_memory:
        return "out_of_memory";
    case ErrorCode::bad_id:
        return "bad_id";
    case ErrorCode::busy: // comes from the caller's functions, which Python has none of
        break;
    }
    return "internal";
}

void translate(const std::exception_ptr& thrown, void*) {
    try {
        std::rethrow_exception(thrown);
    } catch (const Failure& failure) {
        const nb::object type = nb::module_::import_("prolate._errors").attr("Error");
        std::string text = failure.error.what;
        if (!failure.detail.empty()) text += (text.empty() ? "" : ": ") + failure.detail;
        const nb::object error = type(text_of(text), name_of(failure.error.code), failure.error.where);
        PyErr_SetObject(type.ptr(), error.ptr());
    }
}

} // namespace
} // namespace prolate::python

NB_MODULE(_core, m) {
    using namespace prolate;
    // From Python 3.12 on, the interpreter itself refuses such an import, of any module like this one.
    if (PyInterpreterState_GetID(PyInterpreterState_Get()) != 0)
        throw nanobind::import_error("prolate does not support loading in subinterpreters");
    nanobind::register_exception_translator(python::translate);
    m.attr("LIBRARY_VERSION") = library_version();
    m.attr("FORMAT_VERSION") = unsigned{kFormatVersion};
    m.attr("BUILDER_VERSION") = kBuilderVersion;
    python::bind_tree(m);
    python::bind_bake(m);
    python::bind_queries(m);
    python::bind_contacts(m);
    python::bind_deform(m);
    python::bind_points(m);
    python::bind_primitives(m);
    python::bind_pairs(m);
    python::bind_robot(m);
    python::bind_shapes(m);
    python::bind_solids(m);
    python::bind_world(m);
}
