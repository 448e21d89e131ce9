#include "builder/inner.hpp"

#include "builder/cover.hpp"
#include "builder/divide.hpp"
#include "builder/inner_set.hpp"
#include "builder/job.hpp"
#include "builder/obstacles.hpp"
#include "builder/verify_inner.hpp"

#include "src/format.hpp"
#include "src/layout.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

namespace prolate {
namespace {

constexpr int kColumns = 512; // across, to measure the union by
constexpr double kLeastResolution = 32, kMostResolution = 200;

// Of the lattice on which volumes are counted, along the longest side: so that about as many of its points lie inside
// as the quality calls for.
uint32_t lattice_resolution(MeshView mesh, const BakeInfo& tree) {
    const double points = tree.quality == Quality::fast ? 1e4 : tree.quality == Quality::normal ? 6e4 : 2e5;
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    const double pitch = std::cbrt(tree.solid_volume / points);
    return static_cast<uint32_t>(std::clamp(box.size().maxCoeff() / pitch, kLeastResolution, kMostResolution));
}

// Quantises `fit` and shrinks it by the least that brings the decoded ellipsoid inside. Empty if there is no room for
// one that the format can hold.
std::optional<format::PackedNode> inscribed_node(const Fit& fit, const format::Lattice& lattice,
                                                 const TriangleTree& surface, double margin) {
    constexpr int kTries = 64;
    double scale = 1 - kSlack;
    for (int i = 0; i < kTries; ++i) {
        const Fit wanted = fit.scaled(scale);
        const Mat& l = wanted.factor;
        const double factor[6] = {l(0, 0), l(1, 0), l(1, 1), l(2, 0), l(2, 1), l(2, 2)};
        format::PackedNode node;
        format::quantise(node, lattice, fit.center.data(), factor);
        const Fit decoded(format::decode(node, lattice));
        const double room = clearance(decoded, surface, 2) - radial_margin(decoded, margin);
        if (room >= 1 + kSlack) return node;
        if (!(room > 0)) return std::nullopt;
        scale *= room / (1 + kSlack) * (1 - 1e-6 * (1 << std::min(i, 12))); // rounding may undo a tiny step
    }
    return std::nullopt;
}

// A tree above the leaves: some near to each other below each node, which is the largest of them.
class Arranger {
public:
    Arranger(std::span<const format::PackedNode> leaves, const format::Lattice& lattice, uint32_t degree)
        : leaves_(leaves), degree_(degree) {
        for (const format::PackedNode& leaf : leaves) fits_.emplace_back(format::decode(leaf, lattice));
    }

    std::vector<format::PackedLevel> run() const {
        std::vector<Members> groups(1);
        groups[0].resize(leaves_.size());
        std::iota(groups[0].begin(), groups[0].end(), 0u);
        std::vector<format::PackedLevel> levels;
        while (!groups.empty()) {
            std::vector<format::PackedNode>& nodes = levels.emplace_back().nodes;
            std::vector<Members> below;
            for (const Members& group : groups) {
                format::PackedNode& node = nodes.emplace_back(leaves_[largest(group)]);
                if (group.size() == 1) continue;
                std::vector<Members> parts = halved(group, children_of(group.size()));
                node.child_count = static_cast<uint8_t>(parts.size());
                std::move(parts.begin(), parts.end(), std::back_inserter(below));
            }
            groups.swap(below);
        }
        return levels;
    }

private:
    using Members = std::vector<uint32_t>; // leaves

    // As few children as leave the tree as low as can be: full families waste no room in their blocks.
    size_t children_of(size_t leaves) const {
        size_t below = 1; // leaves that a child can have
        while (below * degree_ < leaves) below *= degree_;
        return (leaves + below - 1) / below;
    }
    uint32_t largest(const Members& group) const {
        return *std::max_element(group.begin(), group.end(),
                                 [this](uint32_t a, uint32_t b) { return fits_[a].volume() < fits_[b].volume(); });
    }
    // In `count` parts of about the same size, by place.
    std::vector<Members> halved(const Members& group, size_t count) const {
        if (count == 1) return {group};
        auto [low, high] =
            divide(group, group.size() * (count / 2) / count, [this](uint32_t leaf) { return fits_[leaf].center; });
        std::vector<Members> out = halved(low, count / 2);
        for (Members& part : halved(high, count - count / 2)) out.push_back(std::move(part));
        return out;
    }

    const std::span<const format::PackedNode> leaves_;
    const uint32_t degree_;
    std::vector<Fit> fits_;
};

// Those of the ellipsoids, as they decode, that certainly lie inside.
std::vector<format::PackedNode> packed_inside(std::span<const Fit> fits, const format::Lattice& lattice,
                                              const Winding& winding, double margin) {
    std::vector<std::optional<format::PackedNode>> all(fits.size());
    parallel_for(size_t{0}, fits.size(), [&](size_t i) {
        all[i] = inscribed_node(fits[i], lattice, winding.tree(), margin);
        if (all[i] && !lies_inside(format::decode(*all[i], lattice), winding, margin)) all[i].reset();
    });
    std::vector<format::PackedNode> out;
    for (const auto& node : all)
        if (node) out.push_back(*node);
    return out;
}

// The volume of the union of each cut.
void measure(std::span<format::PackedLevel> levels, const format::Lattice& lattice, const Columns& columns) {
    std::vector<Ellipsoid> leaves; // above the level
    for (format::PackedLevel& level : levels) {
        std::vector<Ellipsoid> cut = leaves;
        for (const format::PackedNode& node : level.nodes) {
            cut.push_back(format::decode(node, lattice));
            if (node.child_count == 0) leaves.push_back(cut.back());
        }
        level.figures.union_volume = measure_cover(columns, cut).whole.value;
    }
}

} // namespace

Result<void> append_inner_cover(std::vector<std::byte>& file, MeshView mesh, const BakeInfo& tree,
                                const InnerOptions& options) {
    const Winding winding(mesh);
    const DistanceField field(mesh, true, winding, lattice_resolution(mesh, tree));
    const std::vector<Fit> fits = inner_set(winding.tree(), field,
                                            {.count = options.count,
                                             .balls = tree.primitive == Primitive::sphere,
                                             .quality = tree.quality,
                                             .seed = tree.seed,
                                             .progress = options.progress});
    Box centers;
    double size = 0;
    for (const Fit& fit : fits) centers.add(fit.center), size = std::max(size, fit.half_extents().maxCoeff());
    const double margin = options.margin + proof_margin(mesh);
    std::vector<format::PackedNode> leaves;
    format::Lattice lattice;
    if (!fits.empty()) {
        lattice = format::lattice_for(centers.low.data(), centers.high.data(), size);
        leaves = packed_inside(fits, lattice, winding, margin);
    }
    if (leaves.empty())
        return Error{ErrorCode::bad_mesh,
                     "the solid is too thin, or too small, for an ellipsoid inside it; bake without an inner cover", 0};
    std::vector<format::PackedLevel> levels = Arranger(leaves, lattice, options.degree).run();
    measure(levels, lattice, measuring_columns(mesh, true, &winding, kColumns));
    BakeInfo info = tree;
    info.inner = true, info.exact = false;
    format::append_section(file, kInnerKind, format::encode(info, options.degree, lattice, levels));
    return {};
}

} // namespace prolate
