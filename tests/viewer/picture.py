"""Screenshots: PNG bytes to pixels, and what can be counted in them. Standard library alone."""
import struct
import zlib


class Picture:
    """width, height, and pixel(x, y) -> (red, green, blue)."""

    def __init__(self, png):
        assert png[:8] == b"\x89PNG\r\n\x1a\n"
        at, data = 8, b""
        while at < len(png):
            size, kind = struct.unpack(">I4s", png[at:at + 8])
            body = png[at + 8:at + 8 + size]
            if kind == b"IHDR":
                self.width, self.height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
                assert depth == 8 and colour in (2, 6) and interlace == 0
                self.channels = 3 if colour == 2 else 4
            elif kind == b"IDAT":
                data += body
            at += size + 12
        self.rows = self._unfilter(zlib.decompress(data))

    def _unfilter(self, data):
        step, stride = self.channels, self.width * self.channels
        rows, above = [], bytearray(stride)
        for y in range(self.height):
            kind = data[y * (stride + 1)]
            row = bytearray(data[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
            for i in range(stride if kind else 0):
                a = row[i - step] if i >= step else 0
                b, c = above[i], above[i - step] if i >= step else 0
                if kind == 1:
                    guess = a
                elif kind == 2:
                    guess = b
                elif kind == 3:
                    guess = (a + b) // 2
                else:
                    p = a + b - c
                    guess = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                row[i] = (row[i] + guess) & 255
            rows.append(row)
            above = row
        return rows

    def pixel(self, x, y):
        at = x * self.channels
        return tuple(self.rows[y][at:at + 3])

    def inked(self, width=None, paper=250):
        """The set of (x, y), x < width, that are not white."""
        return {(x, y) for y in range(self.height) for x in range(width or self.width)
                if min(self.pixel(x, y)) < paper}

    def blobs(self, width=None, least=30):
        """How many connected parts of at least so many pixels are not white."""
        left, count = self.inked(width), 0
        while left:
            todo, size = [left.pop()], 0
            while todo:
                x, y = todo.pop()
                size += 1
                for near in ((x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)):
                    if near in left:
                        left.remove(near)
                        todo.append(near)
            count += size >= least
        return count
