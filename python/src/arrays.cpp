#include "python/src/arrays.hpp"

#include <cmath>
#include <limits>

namespace prolate::python {

void value_error(const std::string& name, const std::string& what) {
    throw nb::value_error((name + ": " + what).c_str());
}
void type_error(const std::string& name, const std::string& what) {
    throw nb::type_error((name + ": " + what).c_str());
}

std::string type_text(nb::handle value) {
    return nb::cast<const char*>(value.type().attr("__name__"));
}

nb::object text_of(const std::string& bytes) {
    return nb::steal(PyUnicode_DecodeUTF8(bytes.data(), static_cast<Py_ssize_t>(bytes.size()), "backslashreplace"));
}

double number(nb::handle value, const char* name) {
    const double out = PyFloat_AsDouble(value.ptr());
    if (out == -1.0 && PyErr_Occurred()) {
        PyErr_Clear();
        type_error(name, "must be a number, not " + type_text(value));
    }
    if (std::isnan(out)) value_error(name, "must not be NaN");
    return out;
}

double number_from_0(nb::handle value, const char* name) {
    const double out = number(value, name);
    if (out < 0) value_error(name, "must be 0 or more");
    return out;
}

uint64_t whole(nb::handle value, const char* name, uint64_t lowest, uint64_t highest) {
    const nb::object index = nb::steal(PyNumber_Index(value.ptr()));
    if (!index.is_valid()) {
        PyErr_Clear();
        type_error(name, "must be a whole number, not " + type_text(value));
    }
    const uint64_t out = PyLong_AsUnsignedLongLong(index.ptr());
    const bool failed = PyErr_Occurred() != nullptr;
    PyErr_Clear();
    if (failed || out < lowest || out > highest)
        value_error(name, "must be " + std::to_string(lowest) + " to " + std::to_string(highest));
    return out;
}

uint64_t whole_or(nb::handle value, const char* name, uint64_t lowest, uint64_t highest, uint64_t none) {
    return value.is_none() ? none : whole(value, name, lowest, highest);
}

float rounded_up(double x) noexcept {
    const auto near = static_cast<float>(x);
    return near < x ? std::nextafterf(near, std::numeric_limits<float>::infinity()) : near;
}

nb::object as_numpy(nb::handle value, const char* name, const char* dtype) {
    const nb::object numpy = nb::module_::import_("numpy");
    try {
        const nb::object array = numpy.attr("asarray")(value);
        // Integers are no floats, nor the other way round but for the wider ones; an empty list is of no type.
        const std::string kind = nb::cast<const char*>(array.attr("dtype").attr("kind"));
        const bool real = kind == "i" || kind == "u" || (kind == "f" && std::string_view(dtype) == "float64");
        if (real || nb::cast<size_t>(array.attr("size")) == 0)
            return numpy.attr("ascontiguousarray")(array, nb::arg("dtype") = dtype);
    } catch (nb::python_error& e) {
        if (!e.matches(PyExc_ValueError) && !e.matches(PyExc_TypeError) && !e.matches(PyExc_OverflowError)) throw;
    }
    type_error(name, std::string("cannot be taken as an array of ") + dtype);
}

Rows<double> rows_of_doubles(nb::handle value, const char* name, size_t columns, bool may_be_single, bool finite) {
    Rows<double> out;
    AnyArray array = import_array(value);
    if (!array.is_valid() || array.dtype() != nb::dtype<double>() || !array.is_contiguous()) {
        out.keep = as_numpy(value, name, "float64");
        array = import_array(out.keep);
    } else {
        out.keep = nb::borrow(value);
    }
    const bool one = may_be_single && array.ndim() == 1 && array.shape(0) == columns;
    if (!one && (array.ndim() != 2 || array.shape(1) != columns)) {
        const std::string n = std::to_string(columns);
        std::string wanted = "must have shape ";
        if (may_be_single) wanted.append("(").append(n).append(",) or ");
        value_error(name, wanted.append("(N, ").append(n).append("), not ").append(array.shape_text()));
    }
    out.single = one;
    out.count = one ? 1 : array.shape(0);
    out.values = {static_cast<const double*>(array.data()), out.count * columns};
    if (finite)
        for (size_t i = 0; i < out.values.size(); ++i)
            if (!std::isfinite(out.values[i]))
                value_error(std::string(name) + "[" + std::to_string(i / columns) + "]", "is not finite");
    return out;
}

OutBytes out_bytes(nb::handle out, size_t count) {
    if (out.is_none()) {
        auto data = new_array<uint8_t>(count);
        uint8_t* const raw = data.get();
        return {raw, to_numpy(std::move(data), {count})};
    }
    nb::ndarray<uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu> array;
    if (!nb::try_cast(out, array, false)) {
        PyErr_Clear();
        type_error("out", "must be a writable, contiguous array of uint8");
    }
    if (array.shape(0) != count)
        value_error("out",
                    "must have shape (" + std::to_string(count) + ",), not (" + std::to_string(array.shape(0)) + ",)");
    return {array.data(), nb::borrow(out)};
}

} // namespace prolate::python
