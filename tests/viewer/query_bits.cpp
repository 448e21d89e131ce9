// Asks the runtime about two trees in many poses, natively, and writes poses and answers: query_bits.mjs asks the same
// of the WebAssembly that the viewer's page carries, and compares the bytes.    query_bits A.etree B.etree OUT
#include "viewer/query_module.hpp"

#include <prolate/tree.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <span>

namespace {

constexpr uint32_t kPoses = 400;

float reach(const prolate::TreeView& tree) {
    const prolate::PrincipalAxes axes = prolate::principal_axes(tree.ellipsoid(0));
    return static_cast<float>(axes.radii[0]);
}

template <class T> void put(std::FILE* out, std::span<const T> values) {
    std::fwrite(values.data(), sizeof(T), values.size(), out);
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 4) return std::fputs("usage: query_bits A.etree B.etree OUT\n", stderr), 2;
    float size = 0;
    for (uint32_t body = 0; body < 2; ++body) {
        const auto tree = prolate::load(argv[1 + body]);
        if (!tree) return std::fprintf(stderr, "query_bits: %s\n", tree.error().what), 1;
        std::ranges::copy(tree->bytes(), viewer_allocate(body, static_cast<uint32_t>(tree->bytes().size())));
        if (!viewer_open(body)) return 1;
        size += reach(tree->view());
    }
    std::FILE* const out = std::fopen(argv[3], "wb");
    if (!out) return 1;
    std::mt19937 random(7);
    // By hand: the standard's distributions may differ from library to library.
    const auto unit = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f * 2 - 1; };
    uint32_t verdicts[3] = {};
    for (uint32_t i = 0; i < kPoses; ++i) {
        for (uint32_t body = 0; body < 2; ++body) {
            float* const pose = viewer_pose(body);
            for (int k = 0; k < 3; ++k) pose[k] = unit() * size * (body == 0 ? 0.1f : 0.4f);
            for (int k = 3; k < 7; ++k) pose[k] = unit();
            put(out, std::span<const float>(pose, 7));
        }
        const ViewerAnswer& answer = *viewer_query(i % 4);
        ++verdicts[static_cast<int>(answer.verdict)];
        put(out, std::span(&answer, 1));
        put(out, std::span(viewer_pairs(), static_cast<size_t>(2 * answer.pair_count)));
    }
    std::fclose(out);
    std::printf("%u separated, %u overlapping of %u\n", verdicts[0], verdicts[1], kPoses);
    // Poses that all answer alike would show little.
    return std::min(verdicts[0], verdicts[1]) >= kPoses / 10 ? 0 : 1;
}
