#include "python/src/arrays.hpp"

namespace prolate::python {

// NumPy's arrays are read where they lie: asking them by DLPack takes longer than many a query. Members and their order
// are those of PyArrayObject_fields and PyArray_Descr, which every extension compiled against NumPy 1.7 or later reads
// by itself (numpy.org, "Python types and C-structures").
namespace {

struct NumpyType { // up to what is read here
    PyObject base;
    PyTypeObject* scalar;
    char kind, letter, byte_order, flags;
    int number;
};
struct NumpyArray {
    PyObject base;
    char* data;
    int ndim;
    Py_ssize_t *shape, *strides;
    PyObject* owner;
    NumpyType* type;
};

nb::dlpack::dtype plain_type(const NumpyType& type) noexcept {
    constexpr auto kLong = static_cast<int>(sizeof(long)); // NumPy numbers its types as C names them
    if (type.byte_order != '=' && type.byte_order != '|') return {};
    const auto made = [](nb::dlpack::dtype_code code, int bytes) {
        return nb::dlpack::dtype{static_cast<uint8_t>(code), static_cast<uint8_t>(8 * bytes), 1};
    };
    switch (type.number) {
    case 2:
        return made(nb::dlpack::dtype_code::UInt, 1);
    case 5:
        return made(nb::dlpack::dtype_code::Int, 4);
    case 6:
        return made(nb::dlpack::dtype_code::UInt, 4);
    case 7:
        return made(nb::dlpack::dtype_code::Int, kLong);
    case 8:
        return made(nb::dlpack::dtype_code::UInt, kLong);
    case 11:
        return made(nb::dlpack::dtype_code::Float, 4);
    case 12:
        return made(nb::dlpack::dtype_code::Float, 8);
    default:
        return {};
    }
}

// Does the NumPy at hand lay arrays out like that? Compared with what an array says of itself.
bool is_as_expected(const nb::object& numpy) {
    const nb::object array = numpy.attr("ones")(nb::make_tuple(2, 3), "float64");
    const nb::object said = array.attr("__array_interface__");
    const auto* const read = reinterpret_cast<const NumpyArray*>(array.ptr());
    return sizeof(Py_ssize_t) == sizeof(int64_t) &&
           nb::cast<uintptr_t>(said["data"][0]) == reinterpret_cast<uintptr_t>(read->data) && read->ndim == 2 &&
           read->shape[0] == 2 && read->shape[1] == 3 && read->strides[0] == 24 && read->strides[1] == 8 &&
           array.attr("dtype").is(reinterpret_cast<PyObject*>(read->type)) && read->type->number == 12 &&
           read->type->byte_order == '=' && nb::cast<int>(array.attr("dtype").attr("num")) == 12;
}

// numpy.ndarray, once somebody has imported it; null if arrays are to be asked instead.
PyTypeObject* numpy_array_type() noexcept {
    static PyTypeObject* known = nullptr;
    static bool asked = false;
    if (asked) return known;
    PyObject* const module = PyDict_GetItemString(PyImport_GetModuleDict(), "numpy");
    if (!module || !PyObject_HasAttrString(module, "ones")) return nullptr; // not yet
    try {
        const nb::object numpy = nb::borrow(module);
        if (is_as_expected(numpy)) known = reinterpret_cast<PyTypeObject*>(numpy.attr("ndarray").ptr());
        asked = true;
    } catch (...) { // it is just being imported
        PyErr_Clear();
    }
    return known;
}

} // namespace

bool AnyArray::take_numpy(nb::handle value) noexcept {
    PyTypeObject* const type = numpy_array_type();
    if (!type || Py_TYPE(value.ptr()) != type) return false;
    const auto* const array = reinterpret_cast<const NumpyArray*>(value.ptr());
    dtype_ = plain_type(*array->type);
    data_ = array->data;
    ndim_ = static_cast<size_t>(array->ndim);
    shape_ = reinterpret_cast<const int64_t*>(array->shape);
    strides_ = reinterpret_cast<const int64_t*>(array->strides);
    return is_valid();
}

AnyArray import_array(nb::handle value) noexcept {
    AnyArray out;
    if (out.take_numpy(value)) return out;
    if (!nb::try_cast(value, out.keep_, false)) {
        PyErr_Clear();
        return {};
    }
    const auto& array = out.keep_;
    out.data_ = array.data();
    out.ndim_ = array.ndim();
    out.shape_ = array.shape_ptr();
    out.strides_ = array.stride_ptr();
    out.stride_unit_ = static_cast<int64_t>(array.itemsize());
    out.dtype_ = array.dtype();
    return out;
}

size_t AnyArray::size() const noexcept {
    size_t out = 1;
    for (size_t i = 0; i < ndim_; ++i) out *= shape(i);
    return out;
}

bool AnyArray::is_contiguous() const noexcept {
    if (dtype_.lanes != 1 || dtype_.bits % 8 != 0) return false;
    const int64_t bytes = dtype_.bits / 8;
    int64_t step = bytes;
    for (size_t i = ndim_; i-- > 0;) {
        if (shape_[i] > 1 && strides_[i] * stride_unit_ != step) return false;
        step *= shape_[i];
    }
    return reinterpret_cast<uintptr_t>(data_) % static_cast<uintptr_t>(bytes) == 0;
}

std::string AnyArray::shape_text() const {
    std::string out = "(";
    for (size_t i = 0; i < ndim_; ++i) out += (i > 0 ? ", " : "") + std::to_string(shape_[i]);
    return out + (ndim_ == 1 ? ",)" : ")");
}

} // namespace prolate::python
