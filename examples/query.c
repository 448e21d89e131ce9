/* Asks whether two baked solids touch, the second one moved by X metres, in C.    query A.etree B.etree X */
#include <prolate/prolate.h>

#include <stdio.h>
#include <stdlib.h>

/* Opens a file in memory that is big enough; the tree points into it. */
static void* load(const char* path, prolate_tree* tree) {
    size_t size = 0;
    prolate_error error = {"", 0};
    prolate_tree_load(path, NULL, 0, &size, tree, NULL);
    void* const bytes = malloc(size + 1);
    if (bytes == NULL || prolate_tree_load(path, bytes, size, NULL, tree, &error) != PROLATE_OK) {
        fprintf(stderr, "query: %s: %s\n", path, error.what);
        exit(1);
    }
    return bytes;
}

int main(int argc, char** argv) {
    if (argc != 4) return fputs("usage: query A.etree B.etree X\n", stderr), 2;
    prolate_tree a, b;
    void *const bytes_a = load(argv[1], &a), *const bytes_b = load(argv[2], &b);
    const size_t scratch_size = prolate_scratch_size_of(&a, &b);
    void* const scratch = malloc(scratch_size); /* some KiB: keep it for all queries of these trees */

    const prolate_pose here = {{0, 0, 0}, {0, 0, 0, 1}}, there = {{strtof(argv[3], NULL), 0, 0}, {0, 0, 0, 1}};
    prolate_collide_result result = PROLATE_INIT(prolate_collide_result);
    const prolate_status status = prolate_collide((prolate_body){&a, here}, (prolate_body){&b, there}, scratch,
                                                  scratch_size, NULL, NULL, &result);
    if (status != PROLATE_OK) return fprintf(stderr, "query: %s\n", prolate_status_text(status)), 1;
    static const char* const words[] = {"separated", "overlapping", "undecided"};
    printf("%s after %llu pair tests\n", words[result.verdict], (unsigned long long)result.stats.pair_tests);
    free(scratch), free(bytes_a), free(bytes_b);
    return 0;
}
