// Arrays in and out. Everything with the buffer protocol or DLPack comes in, without a copy where its layout allows;
// lists and other layouts go through numpy. What is wrong is a ValueError or TypeError that names the argument.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace prolate::python {

namespace nb = nanobind;

/// ValueError or TypeError: "`name`: `what`".
[[noreturn]] void value_error(const std::string& name, const std::string& what);
[[noreturn]] void type_error(const std::string& name, const std::string& what);

/// The name of its type.
std::string type_text(nb::handle value);

/// As Python's text, whatever bytes a file or its name may have.
nb::object text_of(const std::string& bytes);

/// The library's Error; becomes prolate.Error. `detail` follows `what`.
struct Failure {
    Error error;
    std::string detail;
};
template <class T> T value_or_throw(Result<T>&& result, const std::string& detail = "") {
    if (!result) throw Failure{result.error(), detail};
    return std::move(*result);
}
inline void check_done(const Result<void>& result, const std::string& detail = "") {
    if (!result) throw Failure{result.error(), detail};
}

/// A number of Python's. `whole` accepts `lowest` ... `highest` and None, which stands for `none`.
double number(nb::handle value, const char* name);
double number_from_0(nb::handle value, const char* name); ///< not negative, not NaN
uint64_t whole(nb::handle value, const char* name, uint64_t lowest, uint64_t highest);
uint64_t whole_or(nb::handle value, const char* name, uint64_t lowest, uint64_t highest, uint64_t none);

/// The greatest float at most, or the least at least, `x`; infinite beyond the range of floats.
float rounded_up(double x) noexcept;

/// Contiguous rows of T, borrowed from a Python array, or converted.
template <class T> struct Rows {
    std::span<const T> values; ///< `count` times the row's length
    size_t count = 0;
    bool single = false; ///< one row, given without the first dimension
    nb::object keep;     ///< what the span lies in
    std::vector<T> own;  ///< or this
};

/// Shape (N, columns), or (columns,) where `may_be_single`; of doubles, which integers and floats become. All finite,
/// unless `finite` is false.
Rows<double> rows_of_doubles(nb::handle value, const char* name, size_t columns, bool may_be_single,
                             bool finite = true);

/// numpy.ascontiguousarray(value, dtype), with an error that names the argument.
nb::object as_numpy(nb::handle value, const char* name, const char* dtype);

/// Any CPU array that need not be converted. Valid as long as the Python object is.
class AnyArray {
public:
    AnyArray() = default;
    bool is_valid() const noexcept { return dtype_.bits != 0; }
    size_t ndim() const noexcept { return ndim_; }
    size_t shape(size_t i) const noexcept { return static_cast<size_t>(shape_[i]); }
    size_t size() const noexcept;
    const void* data() const noexcept { return data_; }
    nb::dlpack::dtype dtype() const noexcept { return dtype_; }
    /// Are its elements one after the other, the last index fastest, and aligned?
    bool is_contiguous() const noexcept;
    std::string shape_text() const;

private:
    friend AnyArray import_array(nb::handle value) noexcept;
    bool take_numpy(nb::handle value) noexcept;

    const void* data_ = nullptr;
    size_t ndim_ = 0;
    const int64_t *shape_ = nullptr, *strides_ = nullptr;
    int64_t stride_unit_ = 1; ///< bytes
    nb::dlpack::dtype dtype_{};
    nb::ndarray<nb::ro, nb::device::cpu> keep_; ///< what the pointers lie in, if not in the object itself
};
/// Imports `value` if it is an array of a plain type; an invalid array else.
AnyArray import_array(nb::handle value) noexcept;

/// A new numpy array over `data`, which it takes over. Not writable if `read_only`.
template <class T>
nb::object to_numpy(std::unique_ptr<T[]> data, std::initializer_list<size_t> shape, bool read_only = false) {
    T* const raw = data.release();
    const nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    if (read_only) return nb::cast(nb::ndarray<nb::numpy, const T>(raw, shape, owner));
    return nb::cast(nb::ndarray<nb::numpy, T>(raw, shape, owner));
}
template <class T> std::unique_ptr<T[]> new_array(size_t count) {
    return std::unique_ptr<T[]>(new T[count > 0 ? count : 1]);
}
template <class T>
nb::object to_numpy(const std::vector<T>& data, std::initializer_list<size_t> shape, bool read_only = false) {
    auto copy = new_array<T>(data.size());
    std::copy(data.begin(), data.end(), copy.get());
    return to_numpy(std::move(copy), shape, read_only);
}

/// An array to write results to: `out`, if it is one of `count` bytes; None makes a new one.
struct OutBytes {
    uint8_t* data = nullptr;
    nb::object array;
};
OutBytes out_bytes(nb::handle out, size_t count);

} // namespace prolate::python
