// Asks whether two baked solids touch, the second one moved by X metres.    query A.etree B.etree X
#include <prolate/collide.hpp>

#include <cstdio>
#include <cstdlib>
#include <memory>

int main(int argc, char** argv) {
    if (argc != 4) return std::fputs("usage: query A.etree B.etree X\n", stderr), 2;
    const auto a = prolate::load(argv[1]), b = prolate::load(argv[2]);
    for (const auto* tree : {&a, &b})
        if (!*tree) return std::fprintf(stderr, "query: %s\n", tree->error().what), 1;

    const prolate::Pose pose_a, pose_b{{std::strtof(argv[3], nullptr), 0, 0}, {0, 0, 0, 1}};
    const auto context = std::make_unique<prolate::QueryContext>(); // 80 KiB of scratch: keep it for all queries
    const auto result = prolate::collide(a->view(), pose_a, b->view(), pose_b, *context);

    const char* const words[] = {"separated", "overlapping", "undecided"};
    std::printf("%s after %llu pair tests\n", words[static_cast<int>(result.verdict)],
                static_cast<unsigned long long>(result.stats.pair_tests));
    return 0;
}
