"""The page's charts as data: what can be pointed at, zoomed and read out, beside the pictures for print."""
