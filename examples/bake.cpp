// Bakes a mesh into an ellipsoid tree.    bake MESH OUT.etree
#include <prolate/build.hpp>

#include <cstdio>

int fail(const prolate::Error& error) {
    std::fprintf(stderr, "bake: %s (%llu)\n", error.what, static_cast<unsigned long long>(error.where));
    return 1;
}

int main(int argc, char** argv) {
    if (argc != 3) return std::fputs("usage: bake MESH OUT.etree\n", stderr), 2;
    const auto mesh = prolate::load_mesh(argv[1]);
    if (!mesh) return fail(mesh.error());
    const auto baked = prolate::build(mesh->view(), {.degree = 8, .levels = 2});
    if (!baked) return fail(baked.error());
    for (const prolate::LevelReport& level : baked->levels)
        std::printf("%u ellipsoids, %.3f of the solid's volume outside it\n", level.nodes, level.outside_ratio);
    const auto saved = prolate::save(argv[2], baked->tree.bytes());
    return saved ? 0 : fail(saved.error());
}
