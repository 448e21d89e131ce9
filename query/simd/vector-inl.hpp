// The vocabulary of all kernels: vectors of floats and of doubles with one body, pair or child in each lane, masks, and
// vectors, symmetric and triangular matrices of three dimensions made of them. Compiled once for each instruction set:
// include it below <hwy/foreach_target.h>. Vectors have Highway's own operators; what it lacks is here.
//
// Only operations that IEEE 754 rounds exactly are used, each in the order that is written and none across lanes, so
// every instruction set and every number of lanes gives the same bits. Sums of three go from left to right.
#include "query/simd/targets.hpp"

#include "src/bytes.hpp"

#include <hwy/highway.h>

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>

// clang-format off
#if defined(PROLATE_QUERY_VECTOR_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_VECTOR_INL_HPP
#undef PROLATE_QUERY_VECTOR_INL_HPP
#else
#define PROLATE_QUERY_VECTOR_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

static_assert(
    HWY_TARGET == HWY_SCALAR || std::endian::native == std::endian::little,
    "vectors take the file's little-endian numbers as they stand: disable this target in query/simd/targets.hpp");

/// At most eight lanes: the eight of a block are one vector, or several in a loop that goes on by kFloatLanes.
using FloatTag = hn::CappedTag<float, 8>;
using Float = hn::Vec<FloatTag>;
using Mask = hn::Mask<FloatTag>;
inline constexpr size_t kFloatLanes = hn::MaxLanes(FloatTag());

using DoubleTag = hn::CappedTag<double, 8>;
using Double = hn::Vec<DoubleTag>;
inline constexpr size_t kDoubleLanes = hn::MaxLanes(DoubleTag());

/// At most four lanes: the components of one vector, or four triangles.
using QuadTag = hn::CappedTag<float, 4>;
using Quad = hn::Vec<QuadTag>;
inline constexpr size_t kQuadLanes = hn::MaxLanes(QuadTag());

HWY_INLINE Float set(float x) {
    return hn::Set(FloatTag(), x);
}

// ---- Operators and functions of any of these vectors ----

template <class V>
concept Vector = std::same_as<V, Float> || std::same_as<V, Double> || std::same_as<V, Quad>;
/// A number in all lanes of V.
template <Vector V> using LaneOf = hn::TFromV<V>;
template <Vector V> HWY_INLINE V broadcast(LaneOf<V> x) {
    return hn::Set(hn::DFromV<V>(), x);
}

template <Vector V> HWY_INLINE V operator+(V a, LaneOf<V> b) {
    return a + broadcast<V>(b);
}
template <Vector V> HWY_INLINE V operator+(LaneOf<V> a, V b) {
    return broadcast<V>(a) + b;
}
template <Vector V> HWY_INLINE V operator-(V a, LaneOf<V> b) {
    return a - broadcast<V>(b);
}
template <Vector V> HWY_INLINE V operator-(LaneOf<V> a, V b) {
    return broadcast<V>(a) - b;
}
template <Vector V> HWY_INLINE V operator*(V a, LaneOf<V> b) {
    return a * broadcast<V>(b);
}
template <Vector V> HWY_INLINE V operator*(LaneOf<V> a, V b) {
    return broadcast<V>(a) * b;
}
template <Vector V> HWY_INLINE V operator/(LaneOf<V> a, V b) {
    return broadcast<V>(a) / b;
}
template <Vector V> HWY_INLINE V operator-(V a) {
    return hn::Neg(a);
}
template <Vector V> HWY_INLINE auto operator<(V a, LaneOf<V> b) {
    return a < broadcast<V>(b);
}
template <Vector V> HWY_INLINE auto operator>(V a, LaneOf<V> b) {
    return a > broadcast<V>(b);
}
template <Vector V> HWY_INLINE auto operator<=(V a, LaneOf<V> b) {
    return a <= broadcast<V>(b);
}
template <Vector V> HWY_INLINE auto operator>=(V a, LaneOf<V> b) {
    return a >= broadcast<V>(b);
}
template <Vector V> HWY_INLINE auto operator==(V a, LaneOf<V> b) {
    return a == broadcast<V>(b);
}

template <Vector V> HWY_INLINE V abs(V x) {
    return hn::Abs(x);
}
template <Vector V> HWY_INLINE V sqrt(V x) {
    return hn::Sqrt(x);
}
/// Of a NaN, whatever the instruction set makes of it.
template <Vector V> HWY_INLINE V min(V a, V b) {
    return hn::Min(a, b);
}
template <Vector V> HWY_INLINE V max(V a, V b) {
    return hn::Max(a, b);
}
/// The lesser or the greater; a if either is a NaN.
template <Vector V> HWY_INLINE V lesser(V a, V b) {
    return hn::IfThenElse(b < a, b, a);
}
template <Vector V> HWY_INLINE V greater(V a, V b) {
    return hn::IfThenElse(b > a, b, a);
}
template <class M, Vector V> HWY_INLINE V choose(M mask, V yes, V no) {
    return hn::IfThenElse(mask, yes, no);
}
/// x where the mask is set, else 0.
template <class M, Vector V> HWY_INLINE V choose_or_zero(M mask, V x) {
    return hn::IfThenElseZero(mask, x);
}

template <Vector V> HWY_INLINE V load(const LaneOf<V>* from) { // aligned
    return hn::Load(hn::DFromV<V>(), from);
}
HWY_INLINE Float load(const float* from) {
    return load<Float>(from);
}
HWY_INLINE Float load_unaligned(const float* from) {
    return hn::LoadU(FloatTag(), from);
}
template <Vector V> HWY_INLINE void store(V x, LaneOf<V>* to) { // aligned
    hn::Store(x, hn::DFromV<V>(), to);
}
HWY_INLINE void store_unaligned(Float x, float* to) {
    hn::StoreU(x, FloatTag(), to);
}

/// Little-endian integers at any address, as many as Tag has lanes.
template <class T, class Tag> HWY_INLINE auto load_stored(Tag, const std::byte* from) {
    const hn::Rebind<T, Tag> tag;
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(tag, load_le<T>(from));
#else
    const hn::Repartition<uint8_t, decltype(tag)> bytes;
    return hn::BitCast(tag, hn::LoadU(bytes, reinterpret_cast<const uint8_t*>(from)));
#endif
}
/// Those of one or two bytes, of four bytes each.
template <class T> HWY_INLINE auto load_widened(const std::byte* from) {
    return hn::PromoteTo(hn::Rebind<int32_t, FloatTag>(), load_stored<T>(FloatTag(), from));
}
/// And as floats.
template <class T> HWY_INLINE Float load_integers(const std::byte* from) {
    return hn::ConvertTo(FloatTag(), load_widened<T>(from));
}

// ---- Masks ----

HWY_INLINE Mask operator&(Mask a, Mask b) {
    return hn::And(a, b);
}
HWY_INLINE Mask operator|(Mask a, Mask b) {
    return hn::Or(a, b);
}
HWY_INLINE Mask operator^(Mask a, Mask b) {
    return hn::Xor(a, b);
}
HWY_INLINE Mask operator!(Mask mask) {
    return hn::Not(mask);
}
HWY_INLINE bool all(Mask mask) {
    return hn::AllTrue(FloatTag(), mask);
}
/// Bit i is lane i's.
template <class Tag> HWY_INLINE uint32_t bits(Tag tag, hn::Mask<Tag> mask) {
    uint8_t out[8] = {};
    hn::StoreMaskBits(tag, mask, out);
    return out[0];
}
HWY_INLINE uint32_t bits(Mask mask) {
    return bits(FloatTag(), mask);
}

// ---- Three dimensions ----

template <Vector V> struct Vector3 { V x, y, z; };
using Float3 = Vector3<Float>;

/// The same three numbers in all lanes.
template <size_t kSize> HWY_INLINE Float3 set(const float (&v)[kSize]) {
    static_assert(kSize == 3 || kSize == 4);
    return {set(v[0]), set(v[1]), set(v[2])};
}
template <Vector V> HWY_INLINE Vector3<V> operator+(const Vector3<V>& a, const Vector3<V>& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <Vector V> HWY_INLINE Vector3<V> operator-(const Vector3<V>& a, const Vector3<V>& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <Vector V> HWY_INLINE Vector3<V> operator-(const Vector3<V>& v) {
    return {-v.x, -v.y, -v.z};
}
template <Vector V> HWY_INLINE Vector3<V> operator*(const Vector3<V>& v, V s) {
    return {v.x * s, v.y * s, v.z * s};
}
template <Vector V> HWY_INLINE Vector3<V> operator*(const Vector3<V>& v, LaneOf<V> s) {
    return v * broadcast<V>(s);
}
template <Vector V> HWY_INLINE V dot(const Vector3<V>& a, const Vector3<V>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <Vector V> HWY_INLINE Vector3<V> cross(const Vector3<V>& a, const Vector3<V>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <Vector V> HWY_INLINE V length(const Vector3<V>& v) {
    return sqrt(dot(v, v));
}
/// |x| + |y| + |z|
template <Vector V> HWY_INLINE V one_norm(const Vector3<V>& v) {
    return abs(v.x) + abs(v.y) + abs(v.z);
}
template <Vector V> HWY_INLINE V max_norm(const Vector3<V>& v) {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}
template <class M, Vector V> HWY_INLINE Vector3<V> choose(M mask, const Vector3<V>& yes, const Vector3<V>& no) {
    return {choose(mask, yes.x, no.x), choose(mask, yes.y, no.y), choose(mask, yes.z, no.z)};
}
/// To and from three rows of lanes, aligned, from lane `i` on.
template <size_t kCount> HWY_INLINE void store(const Float3& v, float (&rows)[3][kCount], size_t i) {
    store(v.x, rows[0] + i), store(v.y, rows[1] + i), store(v.z, rows[2] + i);
}
template <size_t kCount> HWY_INLINE Float3 load(const float (&rows)[3][kCount], size_t i) {
    return {load(rows[0] + i), load(rows[1] + i), load(rows[2] + i)};
}

/// A symmetric matrix.
struct Sym3 {
    Float xx, xy, yy, xz, yz, zz;
};
HWY_INLINE Sym3 operator+(const Sym3& a, const Sym3& b) {
    return {a.xx + b.xx, a.xy + b.xy, a.yy + b.yy, a.xz + b.xz, a.yz + b.yz, a.zz + b.zz};
}
HWY_INLINE Sym3 operator*(Float s, const Sym3& q) {
    return {s * q.xx, s * q.xy, s * q.yy, s * q.xz, s * q.yz, s * q.zz};
}
HWY_INLINE Float3 operator*(const Sym3& q, const Float3& v) {
    return {q.xx * v.x + q.xy * v.y + q.xz * v.z, q.xy * v.x + q.yy * v.y + q.yz * v.z,
            q.xz * v.x + q.yz * v.y + q.zz * v.z};
}
/// Q + s I
HWY_INLINE Sym3 plus_diagonal(const Sym3& q, Float s) {
    return {q.xx + s, q.xy, q.yy + s, q.xz, q.yz, q.zz + s};
}
HWY_INLINE Float trace(const Sym3& q) {
    return q.xx + q.yy + q.zz;
}
/// det(Q) Q^-1
HWY_INLINE Sym3 adjugate(const Sym3& q) {
    return {q.yy * q.zz - q.yz * q.yz, q.xz * q.yz - q.xy * q.zz, q.xx * q.zz - q.xz * q.xz,
            q.xy * q.yz - q.xz * q.yy, q.xy * q.xz - q.xx * q.yz, q.xx * q.yy - q.xy * q.xy};
}
/// det(Q), of Q and its adjugate
HWY_INLINE Float determinant(const Sym3& q, const Sym3& adjugate) {
    return q.xx * adjugate.xx + q.xy * adjugate.xy + q.xz * adjugate.xz;
}

/// A lower triangular matrix, the factor of an ellipsoid {c + L u : |u| <= 1}.
struct Lower3 {
    Float l11, l21, l22, l31, l32, l33;
};
HWY_INLINE Lower3 operator*(const Lower3& l, Float s) {
    return {l.l11 * s, l.l21 * s, l.l22 * s, l.l31 * s, l.l32 * s, l.l33 * s};
}
HWY_INLINE Float3 operator*(const Lower3& l, const Float3& v) {
    return {l.l11 * v.x, l.l21 * v.x + l.l22 * v.y, l.l31 * v.x + l.l32 * v.y + l.l33 * v.z};
}
/// L^T n
HWY_INLINE Float3 transposed_times(const Lower3& l, const Float3& n) {
    return {l.l11 * n.x + l.l21 * n.y + l.l31 * n.z, l.l22 * n.y + l.l32 * n.z, l.l33 * n.z};
}
/// Q = L L^T, the ellipsoid's shape matrix
HWY_INLINE Sym3 shape_of(const Lower3& l) {
    return {l.l11 * l.l11,
            l.l21 * l.l11,
            l.l21 * l.l21 + l.l22 * l.l22,
            l.l31 * l.l11,
            l.l31 * l.l21 + l.l32 * l.l22,
            l.l31 * l.l31 + l.l32 * l.l32 + l.l33 * l.l33};
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_VECTOR_INL_HPP
